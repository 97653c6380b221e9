"""A page in the browser: hands in three dimensions, and buttons that command them.

The page runs in a separate process (:mod:`.page`, NiceGUI), because making it blocks an event loop for 0.1
s, which is twenty polls. The process receives updates, and sends the commands of its users.
"""

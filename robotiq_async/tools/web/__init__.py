"""A page in the browser: hands in three dimensions, and what a person makes them do.

The page is made in a process of its own (:mod:`.page`, NiceGUI): making it holds up a loop for 0.1 s,
which is twenty polls. It is told what is newest, and asks for what people press.
"""

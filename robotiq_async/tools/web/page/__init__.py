"""The process of the page. Nobody imports it: it is started, and spoken to through its standard streams."""

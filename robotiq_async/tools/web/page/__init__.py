"""The process of the page. It is not imported but started, and uses its standard streams as pipes."""

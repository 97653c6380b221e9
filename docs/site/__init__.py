"""Makes the documentation site: ``make docs``.

==============  ===========================================================================
module          what it does
==============  ===========================================================================
``pages``       gathers the pages, and adapts their links to their new places
``docstrings``  puts the docstrings into Markdown; ``griffe_extension`` has mkdocstrings do so
``check``       looks for dead links, and for what would come from another host
``versions``    puts a built site beside those of other versions
``absolute``    the links of a page where its files are not: on the package index, in release notes
==============  ===========================================================================
"""

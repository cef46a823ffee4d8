"""One self-contained HTML page to compare pictures in: `scenes.py` collects, `page.py` writes.

The page itself is in `page/`: plain HTML, CSS and JavaScript.
"""

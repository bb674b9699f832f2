"""Arms to look at and loops to touch, in the browser: `armlet view` and `armlet lab`.

`model.py` is the laboratory without a screen: it takes the values of sliders, steps the native loop and gives poses. `lab.py` and
`view.py` put it and an arm on a page; they need viser (`pip install 'armlet[live]'`), which `server.py` alone imports.
"""

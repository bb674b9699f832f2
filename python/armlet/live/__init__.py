"""Pages in the browser that show arms (`armlet view`) and run loops by sliders and the mouse (`armlet lab`).

`model.py` is the laboratory without a page: it receives the values of sliders, steps the native loop and returns poses. `lab.py` and
`view.py` put it and an arm on a page; they need viser (`pip install 'armlet[live]'`), which `server.py` alone imports.
"""

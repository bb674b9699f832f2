"""Pages in the browser that show an arm (`armlet view`) and run closed loops with sliders and the mouse (`armlet lab`).

`model.py` is the laboratory without a page: it receives values of sliders, steps the compiled loop and returns poses. `lab.py` and
`view.py` make the pages. They need viser (extra `live`), which only `server.py` imports.
"""

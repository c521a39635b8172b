"""Controllers of one file each.

Every module here is a controller, found by the name of its file: ``sliding_mode.py`` is the
controller ``sliding-mode``. Its function ``controller(context, parameters)`` makes it; nothing else
names it.
"""

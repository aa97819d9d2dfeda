"""Digital calibration certificates (DCC 3.2.1 of PTB): written, read back, and made into a page for people.

``lab`` is what a laboratory states in ``lab.toml``; ``written`` puts results into XML of the parts of ``elements``,
``administration`` and ``results``; ``schema`` checks it; ``reading`` reads certificates of anybody, and ``page`` shows
one.
"""

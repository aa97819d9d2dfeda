"""Study files: site, rig and instrument, read from TOML into frozen dataclasses.

One module per kind of study (``imu``) describes its tables; ``common`` holds the tables all kinds share,
``fields`` the quantities in them, ``load`` reads files, ``schema`` and ``template`` describe them.
"""

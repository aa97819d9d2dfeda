"""A corpus of whole protocols as people bring them: files, commands as a reader of the README types them, the truth.

Its forward model shares no code with inercal. The protocols were written, and parted in two halves by a seed, before
any of them was run; `put_away` is for somebody who has not looked at it.

    python -m benchmarks.protocols --half development [--only NAME] [--show] [--keep FOLDER]
"""

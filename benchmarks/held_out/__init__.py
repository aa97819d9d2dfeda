"""A campaign of faults that the rules of judgement were not written for.

Its simulators share no code with inercal. `kinds.csv` lists what can go wrong; half of it is for development, the other
half is run to judge the rules, and looked at by nobody who writes them.

    python -m benchmarks.held_out.run --half sound --draws 20 --seed 1 --out build/held-out
    python -m benchmarks.held_out.run --half development --draws 2 --seed 1 --out build/held-out
    python -m benchmarks.held_out.table build/held-out
"""

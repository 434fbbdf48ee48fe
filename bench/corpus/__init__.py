"""The yardstick of the analysis: jumps drawn at random on hills that nobody looked at, and their measurement judged.

`draws` says from which distributions a scene is drawn, `scenes` renders it into a log, `judging` sets what was measured
beside the truth, `tables` sums up and compares with the run before. `python -m bench.corpus` (`make corpus`) runs it.
"""

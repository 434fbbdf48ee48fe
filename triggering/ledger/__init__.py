"""Two ledgers of every pulse in every camera: counted from the tags, and recomputed from the evidence in the log.

`account` counts the tags. `recount` judges them: frame by frame of each camera (`tagged_frames`, `stretches`), and
against the reports of the source of the pulses (`source_recount`). Its result is in `recounted`.
"""

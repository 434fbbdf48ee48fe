"""Examines the cameras: do they answer, are they free, can they do what the rig file asks of them?"""

"""Charts: the places of a training in one frame of reference, and what each of them is worth.

Views are matched with each other, which gives links; links and driven commands give the pose of
every view; poses give the floor that is free and where a goal was seen; and those give the worth of
every pose. Lengths are in heights of the camera, as in `macor_hil.mind.foresight`.
"""

"""Which place is the camera in: python docs/examples/robot.py MODEL/ [camera:0 | VIDEO | FOLDER]."""

import sys

import placerec

model, source = (*sys.argv[1:], "camera:0")[:2]
dictionary = placerec.DictionarySet.load(f"{model}/words.npz")
recognizer = placerec.load_recognizer(model, dictionary=dictionary)
(drive,) = placerec.find_sequences([source], endless=True)
before = ""
for frame, belief in placerec.follow_live(drive, dictionary, recognizer):
    if belief.best != before:
        before = belief.best
        print(f"{frame.time:.1f} s: {before}, believed {belief.probability.max():.2f}", flush=True)

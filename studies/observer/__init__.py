"""The study of observers: what encoders cost, and which estimate of the hand's wrench costs least.

Grid and seeds were written down before the first run. The mechanism runs at 512 Hz with Coriolis
compensation and the hold `model`, so that the wrench that the observer sees decides.

- Tuned on: five-bar, four-bar, serial, in the hands constant, profile, arm 100, arm 1000, two draws
  each by the seeds 44001, 44002, ...; 10, 20, 30 Hz by turn; medium gains.
- Kept apart: these and the slider-crank, in the hands constant, profile, arm 300, spring 200, two
  draws each by the seeds 44501, 44502, ...; each at 10, 20 and 30 Hz with soft, medium and stiff
  gains; floors at 20 Hz alone.
- Other devices: five-bar and slider-crank in the hands constant and spring 200, one draw each by
  the seeds 44601, ...; 20 Hz, medium gains; with encoders of four times as many counts, with links
  and handle of a third of the mass, and at 1024 Hz.

A win is a median ratio of 1.5 or more on the draws kept apart, draw by draw against the observer of
the report.
"""

"""Control design on the ground: compensators from plant, delay and weights, their margins, their discrete form.

| file | what |
|---|---|
| linear.py | state space and transfer functions, series connection, frequency response |
| plants.py | double integrator, Pade approximation of a delay, weights |
| lqg.py | LQG, by two Riccati equations |
| glover.py | H-infinity loop shaping after Glover and McFarlane |
| printed.py | the compensators that paper 000 prints, as given and as used |
| discrete.py | exact discretisation: staircase or straight lines between samples |
| margins.py | crossover, phase, gain, delay and modulus margin, continuous and of the sampled loop |
| realisation.py | balanced states, scaled for fixed point, and the bits they need |
| fuzzy.py | Mamdani inference with an exact centroid, as tables |

Nothing here knows a scenario, a rig or a board. Verbs, `sil tables` and tests call it.
"""

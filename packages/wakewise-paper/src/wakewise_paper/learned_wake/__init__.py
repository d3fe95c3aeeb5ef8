"""A learned rival of our wake models: what it is trained on, how, and how all of them meet water they have not seen.

Start reading in `truth.py` (jets of the tank's parcels and of the lattice that push as drawn histories say),
`training.py` (the network's gradient and Adam, in NumPy) and `evaluation.py` (every model against held-out truth).

What is *circular*: the network is trained on the tank's own parcels at the widths and lives of wakes that worlds draw.
In the tank it has seen the law, though not the draw. The lattice's swirling jet and its second history are not trained
on.
"""

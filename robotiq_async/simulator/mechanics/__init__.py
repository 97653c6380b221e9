"""Bodies, contacts and motors: :class:`Physics` computes them with MuJoCo (extra ``physics``)."""

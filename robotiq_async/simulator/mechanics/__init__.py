"""Bodies, contacts and motors: what :class:`Physics` computes with MuJoCo (extra ``physics``)."""

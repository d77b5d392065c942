"""A second version of the model and of the QP, from the equations alone, as evidence."""

"""C made from the table of rows: types, values, factorisation, code of the iteration."""

"""C made from the table of rows: types, values, factorisation, the lines of the iteration."""

"""Results for people: tables, pictures, files, the HTML report."""

"""Results for readers: tables, pictures, files, the HTML report."""

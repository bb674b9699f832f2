"""Reports as one HTML file without network: the page with its style, and the reports of runs and batches."""

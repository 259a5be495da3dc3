"""Rating studies: tables, comparisons, ratings of pairs."""

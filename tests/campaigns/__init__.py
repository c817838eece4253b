"""Long random campaigns against independent references, a sample of each in the tests."""

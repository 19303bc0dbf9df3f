"""Compiled inner loops: plain functions over arrays, one idea a file, each with a slow twin in the tests."""

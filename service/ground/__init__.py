"""The ground that is flown over: height models read, laid onto the plane of the grid, and asked what clears them."""

"""What all sides agree on: messages, mesh, records, emulated channel, graph, time grid. Imports nothing of ours."""

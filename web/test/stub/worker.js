// Stands in for workers: it answers what it is asked.
onmessage = ({ data }) => postMessage(data);

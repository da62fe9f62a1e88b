// Stands in for the worker of the page of one file: it answers what it is asked.
onmessage = ({ data }) => postMessage(data);

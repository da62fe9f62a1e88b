/** lexisplat/spark in Node. */

import './index.js';

export * from '../spark.js';

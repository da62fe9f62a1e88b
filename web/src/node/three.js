/** lexisplat/three in Node. */

import './index.js';

export * from '../three.js';

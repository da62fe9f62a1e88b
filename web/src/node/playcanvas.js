/** lexisplat/playcanvas in Node. */

import './index.js';

export * from '../playcanvas.js';

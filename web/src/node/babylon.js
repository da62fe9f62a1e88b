/** lexisplat/babylon in Node. */

import './index.js';

export * from '../babylon.js';

/** The package in Node: as in browsers, with worker threads, and with paths and `file:` addresses of files. */

import { setPlatform } from '../env.js';
import { platform } from './platform.js';

setPlatform(platform);

export { open, Scene } from '../index.js';

/** A thread that decodes files whole. */

import { parentPort } from 'node:worker_threads';
import * as wasm from '../../wasm/files.js';
import { handlerOf } from '../handler.js';
import { serve } from '../serve.js';

serve((module) => (wasm.initSync({ module }), wasm), handlerOf, parentPort);

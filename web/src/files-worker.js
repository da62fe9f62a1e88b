/** A worker that decodes files whole. */

import * as wasm from '../wasm/files.js';
import { handlerOf } from './handler.js';
import { serve } from './serve.js';

serve((module) => (wasm.initSync({ module }), wasm), handlerOf);

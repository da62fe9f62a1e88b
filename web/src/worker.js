/** A worker that decodes. */

import * as wasm from '../wasm/decoder.js';
import { handlerOf } from './handler.js';
import { serve } from './serve.js';

serve((module) => (wasm.initSync({ module }), wasm), handlerOf);

/** A worker of the viewer. */

import * as wasm from '../wasm/viewer.js';
import { serve } from './serve.js';
import { viewerHandlerOf } from './viewer-handler.js';

serve((module) => (wasm.initSync({ module }), wasm), viewerHandlerOf);

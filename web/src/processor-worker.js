/** A worker that draws on the processor. */

import * as wasm from '../wasm/processor.js';
import { serveProcessor } from './processor-handler.js';

serveProcessor(wasm);

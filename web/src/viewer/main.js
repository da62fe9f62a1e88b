// The page of the viewer in a folder of files.

import { folder } from './folder.js';
import { startPage } from './page.js';

startPage(folder);

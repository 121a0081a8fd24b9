/** Before each file of tests: our modules begin anew, though the files share a process (which makes them four times as fast). */

import { vi } from "vitest";

vi.unstubAllGlobals();
vi.useRealTimers();
vi.resetModules();

// What CoWasm takes for granted, because Node has it.
import { Buffer } from "buffer";
import process from "process/browser.js";

export const told = self.onmessage; // CoWasm puts its own in its place

process.argv = ["python"];
process.pid = 1;
Object.assign(globalThis, { Buffer, process, global: globalThis });

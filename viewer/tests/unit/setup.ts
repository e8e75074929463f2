import { webcrypto } from "node:crypto";

globalThis.crypto ??= webcrypto as Crypto;  // node 18 has it by another name

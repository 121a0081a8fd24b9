/** The encoding of a channel whose messages are sealed; a module of its own, as every page asks for it and few open anything. */

export const SEALED_CDR = "sealed/cdr";

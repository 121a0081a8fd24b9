/** What the package @metaros/client gives: the client, its error, and the types of everything that a gateway answers. */

export { GatewayClient, GatewayError, type ClientOptions } from "./gateway_client.js";
export type { AnswerOf, Arguments, BodyOf, Given, Operation, QueryOf } from "./operation.js";
export type * from "./schema.js";

/** Typed calls about one robot's link. */

import { call } from "./call";

const at = (id: string) => ({ path: { robot_id: id } });

export const robotApi = {
  gaps: async (id: string, limit: number) => (await call("GET /robots/{robot_id}/gaps", { ...at(id), query: { limit } })).gaps,
  setUplink: (id: string, bytesPerS: number | null) => call("PUT /robots/{robot_id}/uplink", { ...at(id), body: { bytes_per_s: bytesPerS } }),
};

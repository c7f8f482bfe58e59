// Has the service do what takes too long to wait for, and tells how it goes.

import { ask, send } from "./service_client.js";

const INTERVAL = 400; // ms

// Returns the result of a job, fetched by `fetched`; `told` is called with how it stands, in words.
export async function doJob(order, told, fetched = ask) {
  let job = await send("/api/v1/jobs", order);
  const place = `/api/v1/jobs/${job.job}`;
  while (["waiting", "running"].includes(job.state)) {
    told(job.state === "waiting" ? "Waiting for another job …" : `${job.step} ${job.progress === null ? "" : `${Math.round(100 * job.progress)} %`} …`);
    await new Promise((done) => setTimeout(done, INTERVAL));
    job = await ask(place);
  }
  if (job.state !== "done") throw new Error(job.detail || `the job was ${job.state}`);
  return fetched(job.result, 10000);
}

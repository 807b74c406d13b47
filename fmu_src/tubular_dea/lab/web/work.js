/* The page's own engine, and workers for what takes longer than a frame. */

const bytes = Uint8Array.from(atob(document.getElementById("wasm").textContent), (c) => c.charCodeAt(0));
let engine = null, jobNumber = 0;

class Helper {
  constructor() {
    const source = ["shared", "worker"].map((id) => document.getElementById(id).textContent).join("\n");
    const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    this.waiting = new Map();
    this.worker = new Worker(url);
    this.worker.onmessage = ({ data }) => this.answered(data);
    const { recordings, state: _, ...needed } = facts;
    this.worker.postMessage({ start: { facts: needed, bytes } });
  }

  answered(data) {
    const job = this.waiting.get(data.number);
    this.waiting.delete(data.number);
    if (data.problem) job?.fail(new Error(data.problem));
    else job?.done(data.result, data.took);
  }

  ask(kind, job) {
    const number = ++jobNumber;
    return new Promise((resolve, reject) => {
      this.waiting.set(number, { done: (result, took) => resolve({ result, took }), fail: reject });
      this.worker.postMessage({ kind, number, ...job });
    });
  }

  stop() {
    this.worker.terminate();
  }
}

/* One job at a time; while it runs, only the newest of those that come is kept. */
class Latest {
  /* `other` has a worker that is shared. */
  constructor(kind, show_, other = null) {
    Object.assign(this, { kind, show: show_, busy: false, next: null, took: NaN, helper: null });
    if (other) this.helper = other.helper ??= new Helper();
  }

  ask(job) {
    if (this.busy) { this.next = job; return; }
    this.busy = true;
    this.helper ??= new Helper();
    this.helper.ask(this.kind, job).then(({ result, took }) => { this.took = took; this.show(result, job); },
      (problem) => notice(`The computation failed: ${problem.message}`)).finally(() => {
      this.busy = false;
      const next = this.next;
      this.next = null;
      if (next) this.ask(next);
    });
  }
}

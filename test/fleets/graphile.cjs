// graphile.cjs HOST WORKERS COUNT: graphile-worker with its defaults, until that many empty tasks have run. It prints
// how long that took from the first to the last of them. (COUNT 0: it only makes its schema.)
const { run, runMigrations, Logger } = require("graphile-worker");

const [host, workers, count] = process.argv.slice(2);
const options = {
  connectionString: `postgres://owner@/fleet?host=${encodeURIComponent(host)}`,
  concurrency: Number(workers),
  maxPoolSize: Math.max(10, Number(workers) + 2),
  noHandleSignals: true,
  logger: new Logger(() => () => {}),
};

async function main() {
  if (Number(count) === 0) return runMigrations(options);
  let ran = 0;
  let first;
  await new Promise((resolve) => {
    const empty = async () => {
      first ??= performance.now();
      ran += 1;
      if (ran === Number(count)) resolve();
    };
    run({ ...options, taskList: { empty } }).then((runner) => {
      main.runner = runner;
    });
  });
  console.log((performance.now() - first) / 1000);
  await main.runner.stop();
}

main();

// node validate.js MODULES FILE...
// Runs Khronos' validator of MODULES/gltf-validator over each file, prints what it says, and ends with 1 when it finds
// an error or a warning.
const fs = require("fs");
const path = require("path");

const [modules, ...files] = process.argv.slice(2);
const validator = require(path.resolve(modules, "gltf-validator"));

async function issues(file) {
  const read = (uri) => new Uint8Array(fs.readFileSync(path.resolve(path.dirname(file), decodeURIComponent(uri))));
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: path.basename(file),
    externalResourceFunction: async (uri) => read(uri),
    maxIssues: 0,
  });
  for (const message of report.issues.messages) {
    console.log(`${path.basename(file)}: ${message.code} at ${message.pointer}: ${message.message}`);
  }
  const { numErrors, numWarnings, numInfos } = report.issues;
  console.log(`${path.basename(file)}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} notes`);
  return numErrors + numWarnings;
}

(async () => {
  let found = 0;
  for (const file of files) found += await issues(file);
  process.exit(found > 0 ? 1 : 0);
})();

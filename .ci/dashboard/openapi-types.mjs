// Writes the schemas of an OpenAPI document as TypeScript types: `node openapi-types.mjs openapi.json > openapi.d.ts`.

import { readFileSync } from "node:fs";

/** The type of a schema, as TypeScript. */
function type(schema) {
  if (schema.$ref) return `Schemas[${JSON.stringify(schema.$ref.split("/").at(-1))}]`;
  if (schema.enum) return union(schema.enum.map((value) => JSON.stringify(value)));
  if ("const" in schema) return JSON.stringify(schema.const);
  const choices = schema.oneOf ?? schema.anyOf;
  if (choices) return union(choices.map(type));
  if (schema.allOf) return schema.allOf.map((part) => `(${type(part)})`).join(" & ");
  return union([schema.type ?? "unknown"].flat().map((name) => named(name, schema)));
}

const union = (types) => [...new Set(types)].map((one) => `(${one})`).join(" | ");

/** The type of a schema whose JSON type is `name`. */
function named(name, schema) {
  switch (name) {
    case "array":
      return schema.prefixItems ? `[${schema.prefixItems.map(type).join(", ")}]` : `(${type(schema.items ?? {})})[]`;
    case "object":
      return object(schema);
    case "integer":
      return "number";
    default:
      return name;
  }
}

function object({ properties, required = [], additionalProperties }) {
  const fields = Object.entries(properties ?? {}).map(
    ([name, schema]) => `${JSON.stringify(name)}${required.includes(name) ? "" : "?"}: ${type(schema)};`,
  );
  const others = additionalProperties && `Record<string, ${additionalProperties === true ? "unknown" : type(additionalProperties)}>`;
  if (fields.length === 0) return others || "Record<string, unknown>";
  return others ? `{ ${fields.join(" ")} } & ${others}` : `{ ${fields.join(" ")} }`;
}

const { schemas } = JSON.parse(readFileSync(process.argv[2], "utf8")).components;
console.log("export interface Schemas {");
for (const [name, schema] of Object.entries(schemas)) console.log(`  ${JSON.stringify(name)}: ${type(schema)};`);
console.log("}");

// The little that the tests use of Node's modules.

declare module "node:test" {
  export function test(name: string, body: () => void | Promise<void>): void;
}

declare module "node:assert/strict" {
  const assert: any;
  export default assert;
}

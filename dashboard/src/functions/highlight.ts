/** Colours for code that is only looked at: comments, strings, numbers and words of the language. */

export type Token = "comment" | "string" | "number" | "word" | "name" | "";

const PYTHON_WORDS = "False|None|True|and|as|assert|async|await|break|case|class|continue|def|del|elif|else|except|finally|for|from|global|if|import|in|is|lambda|match|nonlocal|not|or|pass|raise|return|try|while|with|yield";
const PYTHON = new RegExp(
  [
    String.raw`(?<comment>#.*)`,
    String.raw`(?<string>[rbfuRBFU]{0,2}(?:"""[^]*?(?:"""|$)|'''[^]*?(?:'''|$)|"(?:\\.|[^"\\\n])*"?|'(?:\\.|[^'\\\n])*'?))`,
    String.raw`(?<name>(?<=\b(?:def|class)\s+)\w+|@[\w.]+)`,
    String.raw`(?<word>\b(?:${PYTHON_WORDS})\b)`,
    String.raw`(?<number>\b\d[\d_.]*(?:e[+-]?\d+)?\b)`,
  ].join("|"),
  "g",
);
const DATA = /(?<comment>(?:^|\s)#.*)|(?<string>"(?:\\.|[^"\\\n])*")|(?<word>\b(?:true|false|null)\b)|(?<number>-?\b\d[\d.]*\b)/gm;

const LANGUAGES: [RegExp, RegExp][] = [
  [/\.pyi?$/, PYTHON],
  [/\.(json|ya?ml|toml|cfg|ini)$/, DATA],
];

/** Longer ones are shown plain: nobody reads colours of a megabyte. */
const MOST_CHARS = 60_000;

/** The text in pieces, each with its colour. */
export function highlighted(path: string, text: string): [Token, string][] {
  const language = LANGUAGES.find(([name]) => name.test(path))?.[1];
  if (!language || text.length > MOST_CHARS) return [["", text]];
  const found: [Token, string][] = [];
  let at = 0;
  for (const match of text.matchAll(language)) {
    if (match.index > at) found.push(["", text.slice(at, match.index)]);
    const token = Object.entries(match.groups!).find(([, said]) => said !== undefined)![0] as Token;
    found.push([token, match[0]]);
    at = match.index + match[0].length;
  }
  if (at < text.length) found.push(["", text.slice(at)]);
  return found;
}

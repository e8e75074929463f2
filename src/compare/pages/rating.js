// The rating sheet of `cnerf compare --rating-sheet`: shows the pictures in #data and saves a rater's grades.
'use strict';

const { sheet, views } = JSON.parse(document.getElementById('data').textContent);
const scales = ['plausibility', 'vividness'];

function make(name, properties = {}, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}
const grades = (item, scale) => make('fieldset', {}, make('legend', {}, scale), ...[1, 2, 3, 4, 5].map((grade) =>
  make('label', {}, make('input', { type: 'radio', name: `${item}-${scale}`, value: grade }), String(grade))));
const pictureToJudge = ({ item, picture }) => make('figure', { id: item },
  make('img', { alt: `picture ${item}`, src: picture }), ...scales.map((scale) => grades(item, scale)));
document.getElementById('views').append(...views.map((view) => make('section', {}, ...view.map(pictureToJudge))));

document.querySelector('button').addEventListener('click', () => {
  const answers = [];
  let first = null;
  for (const shown of document.querySelectorAll('figure')) {
    const answer = { item: shown.id };
    for (const scale of scales) {
      answer[scale] = Number(shown.querySelector(`input[name="${shown.id}-${scale}"]:checked`)?.value ?? 0);
    }
    const isMissing = scales.some((scale) => !answer[scale]);
    shown.classList.toggle('missing', isMissing);
    if (isMissing) first ??= shown;
    answers.push(answer);
  }
  if (first) { first.scrollIntoView(); return; }
  const file = new Blob([JSON.stringify({ sheet, answers }, null, 1)], { type: 'application/json' });
  make('a', { href: URL.createObjectURL(file), download: `answers-${Date.now()}.json` }).click();
});

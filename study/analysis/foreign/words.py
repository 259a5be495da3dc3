"""Words for right and wrong, yes and no, same and different, first and second, as programs and spreadsheets write it.

A spreadsheet writes true and false in the language that it is set to: a German one makes WAHR and FALSCH of TRUE and
FALSE. No word stands on both sides. All are in small letters.
"""

from __future__ import annotations

_TRUE = (
    "1 true t wahr richtig vrai verdadero vero verdadeiro waar prawda sant sand sandt sann tosi pravda igaz doğru "
    "adevărat истина αληθες αληθής 真 참"
)
_FALSE = (
    "0 false f falsch faux falso onwaar fałsz falskt falsk usand usann epätosi nepravda hamis yanlış yanliş fals ложь "
    "ψευδες ψευδής 假 偽 거짓"
)
_YES = "yes y ja oui sí si sì sim tak kyllä ano igen evet да da ναι はい 是 예 네"
_NO = "no n nein non não nao nee nie nej nei ei ne nem hayır hayir нет nu όχι いいえ 否 아니요"

YES = {
    "2afc": f"{_TRUE} {_YES} correct right hit korrekt juste correcto correcta corretto corretta correto certo juist "
    "goed rätt riktig rigtig oikein poprawne poprawna správně верно правильно 正解 正确 对 정답",
    "yes-no": f"{_TRUE} {_YES} seen present gesehen vu visto gezien",
    "same-different": f"different d diff {_TRUE} verschieden unterschiedlich anders différent différents différente "
    "diferente diferentes diverso diversi verschillend olika forskellig forskjellig różne разные 違う 不同 다름",
}
NO = {
    "2afc": f"{_FALSE} {_NO} incorrect wrong miss inkorrekt incorrecto incorrecta scorretto errato sbagliato "
    "incorreto errado onjuist fout fel feil forkert väärin niepoprawne niepoprawna špatně "
    "неверно неправильно 不正解 错误 错 오답",
    "yes-no": f"{_FALSE} {_NO} unseen absent",
    "same-different": f"same s gleich {_FALSE} identisch identique identiques pareil igual iguales uguale uguali "
    "gelijk hetzelfde samma ens одинаковые 同じ 相同 같음",
}
FIRST = (
    "first 1 left arrowleft erste erster erstes links premier première gauche primero primera izquierda primo prima "
    "sinistra primeiro primeira esquerda eerste första vänster første venstre pierwszy lewy первый левый 左"
)
SECOND = (
    "second 2 right arrowright zweite zweiter zweites rechts deuxième seconde droite segundo segunda derecha secondo "
    "seconda destra direita tweede andra höger anden andre højre høyre drugi prawy второй правый 右"
)
BLANK = ("", "nan", "none", "null", "na", "n/a", "<na>", "#n/a", "#null!", "undefined", ".", "-", "--", "\\n")

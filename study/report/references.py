"""Works that a report cites, as a list of references gives them."""

from __future__ import annotations

FIELLER_1954 = (
    "Fieller, E. C. (1954). Some problems in interval estimation. Journal of the Royal Statistical Society B, 16, "
    "175–185."
)
MACMILLAN_2005 = (
    "Macmillan, N. A., & Creelman, C. D. (2005). Detection theory: A user’s guide (2nd ed., ch. 9). Erlbaum."
)
WILSON_1927 = (
    "Wilson, E. B. (1927). Probable inference, the law of succession, and statistical inference. Journal of the "
    "American Statistical Association, 22, 209–212."
)
HOLM_1979 = (
    "Holm, S. (1979). A simple sequentially rejective multiple test procedure. Scandinavian Journal of Statistics, 6, "
    "65–70."
)
SCHUIRMANN_1987 = (
    "Schuirmann, D. J. (1987). A comparison of the two one-sided tests procedure and the power approach. Journal of "
    "Pharmacokinetics and Biopharmaceutics, 15, 657–680."
)
CAMERON_2011 = (
    "Cameron, A. C., Gelbach, J. B., & Miller, D. L. (2011). Robust inference with multiway clustering. Journal of "
    "Business & Economic Statistics, 29, 238–249."
)
CLARK_1973 = (
    "Clark, H. H. (1973). The language-as-fixed-effect fallacy: A critique of language statistics in psychological "
    "research. Journal of Verbal Learning and Verbal Behavior, 12, 335–359."
)
SATTERTHWAITE_1946 = (
    "Satterthwaite, F. E. (1946). An approximate distribution of estimates of variance components. Biometrics "
    "Bulletin, 2, 110–114."
)
AS_SAMPLES = (
    "with participants and motions as samples (Clark 1973) and Satterthwaite’s degrees of freedom (1946), made smaller "
    "for few motions"
)
JONELL_2021 = (
    "Jonell, P., Yoon, Y., Wolfert, P., Kucherenko, T., & Henter, G. E. (2021). HEMVIP: Human evaluation of multiple "
    "videos in parallel. Proceedings of the International Conference on Multimodal Interaction, 707–711."
)
DAVIDSON_1970 = (
    "Davidson, R. R. (1970). On extending the Bradley-Terry model to accommodate ties in paired comparison "
    "experiments. Journal of the American Statistical Association, 65, 317–328."
)
BRADLEY_1952 = (
    "Bradley, R. A., & Terry, M. E. (1952). Rank analysis of incomplete block designs. Biometrika, 39, 324–345."
)

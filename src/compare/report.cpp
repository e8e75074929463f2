#include "src/compare/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "src/compare/methods.h"

namespace cnerf::compare {
namespace {

constexpr const char* kStyle = R"css(
:root { color-scheme: light dark; --line: #8884; --soft: #8881; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1200px; margin: 2rem auto; padding: 0 1rem; }
h2 { margin-top: 3rem; border-bottom: 1px solid var(--line); }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 1rem 0; }
td, th { padding: .2rem .6rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
td:first-child, th:first-child { text-align: left; }
td.best { font-weight: bold; }
.wide { overflow-x: auto; }
.pictures { display: grid; gap: 6px; grid-template-columns: repeat(auto-fill, minmax(220px, 1fr)); }
figure { margin: 0; } figure img { width: 100%; display: block; } figcaption { font-size: 13px; opacity: .8; }
.slider { position: relative; max-width: 640px; }
.slider img { width: 100%; display: block; }
.slider .over { position: absolute; inset: 0; }
.slider input { position: absolute; inset: auto 0 0 0; width: 100%; margin: 0; }
svg { background: var(--soft); margin: 4px; } svg text { fill: currentColor; font: 11px system-ui, sans-serif; }
code { background: var(--soft); padding: 0 .2em; } .failed { color: #c33; }
)css";

constexpr const char* kScript = R"js(
for (const box of document.querySelectorAll('.compare')) {
  const [view, left, right] = box.querySelectorAll('select');
  const [under, over] = box.querySelectorAll('.slider img');
  const split = box.querySelector('.slider input');
  const find = (name) => document.getElementById(`${box.dataset.capture}/${view.value}/${name}`);
  const show = () => {
    under.src = find(right.value)?.src ?? '';
    over.src = find(left.value)?.src ?? '';
    over.style.clipPath = `inset(0 ${100 - split.value}% 0 0)`;
  };
  for (const control of [view, left, right, split]) control.addEventListener('input', show);
  show();
}
for (const table of document.querySelectorAll('.turntables')) {
  const strips = [...table.querySelectorAll('figure')].map((figure) => ({
    shown: figure.querySelector('img'),
    frames: JSON.parse(figure.querySelector('script').textContent),
  }));
  const place = table.parentElement.querySelector('input');
  const button = table.parentElement.querySelector('button');
  let at = 0, timer = null;
  const show = () => { for (const s of strips) s.shown.src = s.frames[at % s.frames.length]; place.value = at; };
  const length = Math.max(...strips.map((s) => s.frames.length));
  place.max = length - 1;
  place.addEventListener('input', () => { at = Number(place.value); show(); });
  button.addEventListener('click', () => {
    if (timer) { clearInterval(timer); timer = null; button.textContent = 'Play'; return; }
    timer = setInterval(() => { at = (at + 1) % length; show(); }, 1000 / Number(table.dataset.fps));
    button.textContent = 'Stop';
  });
  show();
}
)js";

constexpr const char* kPaperTable = R"html(
<p>The paper's Table 1 cannot be repeated: eight of its ten scenes were never published, its colorizer (CT2) is a
network whose weights do not come with this program, and it names neither the held-out views nor the resolution. So the methods
are compared here with each other, on the same captures, geometry, colorizer and number of steps. For orientation, what
the paper reports:</p>
<table><tr><th>Paper, Table 1</th><th>PSNR</th><th>SSIM</th><th>LPIPS</th><th>Colourful</th><th>Δ Colourful</th></tr>
<tr><td>Vid + NeRF</td><td>17.78</td><td>0.63</td><td>0.31</td><td>12.88</td><td>23.59</td></tr>
<tr><td>ARF</td><td>17.82</td><td>0.54</td><td>0.37</td><td>36.33</td><td></td></tr>
<tr><td>CLIP-NeRF</td><td>17.76</td><td>0.76</td><td>0.31</td><td>30.92</td><td>12.18</td></tr>
<tr><td>CT2 + NeRF</td><td>18.90</td><td>0.80</td><td>0.32</td><td>48.52</td><td>18.24</td></tr>
<tr><td>without purification</td><td>17.74</td><td>0.77</td><td>0.25</td><td>54.41</td><td>19.20</td></tr>
<tr><td>without classification</td><td>19.22</td><td>0.81</td><td>0.22</td><td>49.28</td><td>12.82</td></tr>
<tr><td>ColorNeRF</td><td>20.76</td><td>0.81</td><td>0.21</td><td>55.40</td><td>12.15</td></tr></table>
)html";

constexpr std::array kColors = {"#d62728", "#ff7f0e", "#2ca02c", "#1f77b4", "#9467bd",
                                "#8c564b", "#7f7f7f", "#17becf", "#bcbd22", "#e377c2"};

std::string color_of(const std::string& method) {
  const std::vector<std::string> names = method_names();
  const auto at = std::size_t(std::ranges::find(names, method) - names.begin());
  return kColors[at % kColors.size()];
}

std::string element(const char* name, const std::string& content) {
  return fmt::format("<{0}>{1}</{0}>", name, content);
}

std::string number(const std::optional<Estimate>& value, int digits) {
  if (!value) return "";
  std::string text = fmt::format("{:.{}f}", value->mean, digits);
  if (value->n > 1) text += fmt::format(" ± {:.{}f}", value->half_width, digits);
  return text;
}

/// The best mean of a column; the bounds do not compete.
std::optional<double> best_of(const std::vector<ComparisonRow>& rows, std::size_t column) {
  const int better = comparison_columns()[column].better;
  std::optional<double> best;
  for (const ComparisonRow& row : rows) {
    if (better == 0 || !row.columns[column] || row.method == "grey" || row.method == "oracle") continue;
    const double mean = row.columns[column]->mean;
    if (!best || better * mean > better * *best) best = mean;
  }
  return best;
}

std::string table_html(const std::vector<ComparisonRow>& rows) {
  const auto columns = comparison_columns();
  std::string html = "<div class=\"wide\"><table><tr><th>Method</th>";
  for (const ComparisonColumn& column : columns) {
    const char* arrow = column.better > 0 ? " ↑" : column.better < 0 ? " ↓" : "";
    html += fmt::format("<th title=\"{}\">{}{}</th>", html_text(column.help), html_text(column.title), arrow);
  }
  html += "</tr>";
  for (const ComparisonRow& row : rows) {
    html += "<tr><td>" + html_text(row.method) + "</td>";
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const auto best = best_of(rows, c);
      const bool is_best = best && row.columns[c] && row.columns[c]->mean == *best;
      html += fmt::format("<td{}>{}</td>", is_best ? " class=\"best\"" : "", number(row.columns[c], columns[c].digits));
    }
    html += "</tr>";
    if (!row.error.empty()) {
      html += fmt::format("<tr><td class=\"failed\" colspan=\"{}\">{} failed: {}</td></tr>", columns.size() + 1,
                          html_text(row.method), html_text(row.error));
    }
  }
  return html + "</table></div>";
}

std::string duels_html(std::span<const ComparisonCell> cells) {
  const std::vector<Duel> all = duels(cells);
  if (all.empty()) return "";
  std::string html =
      "<h2>colornerf against the others</h2><p>Pairs of equal capture and seed in which colornerf is better, and by "
      "how "
      "much on average (above 0: better).</p><table><tr><th>Against</th><th>Number</th><th>Better in</th><th>Mean "
      "gain</th></tr>";
  for (const Duel& duel : all) {
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{} of {}</td><td>{:+.{}f}</td></tr>", html_text(duel.method),
                        html_text(duel.column->title), duel.wins, duel.pairs, duel.mean_gain, duel.column->digits + 1);
  }
  return html + "</table>";
}

struct PlotPoint {
  std::string method, label;
  double x = 0, y = 0, half_width = 0;
};

/// Points over positions 0 … positions - 1.
std::string plot(const std::string& title, const std::vector<PlotPoint>& points, std::size_t positions) {
  if (points.empty()) return "";
  constexpr double kWidth = 360, kHeight = 200, kLeft = 46, kTop = 26, kRight = 10, kBottom = 18;
  double low = points.front().y, high = low;
  for (const PlotPoint& point : points) {
    low = std::min(low, point.y - point.half_width);
    high = std::max(high, point.y + point.half_width);
  }
  const double margin = std::max(0.05 * (high - low), 1e-6);
  low -= margin;
  high += margin;
  const auto place_x = [&](double x) { return kLeft + (x + 0.5) / double(positions) * (kWidth - kLeft - kRight); };
  const auto place_y = [&](double y) { return kTop + (high - y) / (high - low) * (kHeight - kTop - kBottom); };
  std::string svg =
      fmt::format("<svg width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\"><text x=\"8\" y=\"16\">{2}</text>", kWidth,
                  kHeight, html_text(title));
  for (const double y : {low + margin, high - margin}) {
    svg += fmt::format("<text x=\"4\" y=\"{:.1f}\">{:.4g}</text>", place_y(y) + 4, y);
  }
  for (const PlotPoint& point : points) {
    const double x = place_x(point.x), y = place_y(point.y);
    const std::string color = color_of(point.method);
    if (point.half_width > 0) {
      svg += fmt::format("<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" y2=\"{2:.1f}\" stroke=\"{3}\"/>", x,
                         place_y(point.y - point.half_width), place_y(point.y + point.half_width), color);
    }
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.5\" fill=\"{}\"><title>{}: {:.4g}</title></circle>",
                       x, y, color, html_text(point.method + ", " + point.label), point.y);
  }
  return svg + "</svg>";
}

std::string legend(std::span<const ComparisonCell> cells) {
  std::string html = "<p>";
  for (const std::string& method : method_names()) {
    if (std::ranges::find(cells, method, &ComparisonCell::method) == cells.end()) continue;
    html += fmt::format("<span style=\"color:{}\">●</span> {} &nbsp; ", color_of(method), html_text(method));
  }
  return html + "</p>";
}

/// One plot a number: views along x, methods as colours; of the first seed that is there.
std::string view_plots(std::span<const ComparisonCell> cells, const std::string& capture) {
  struct Number {
    const char* name;
    const char* title;
  };
  constexpr Number kNumbers[] = {{"psnr_rgb", "PSNR, dB"},
                                 {"lpips", "LPIPS"},
                                 {"ab_error", "ab error"},
                                 {"colourfulness_difference", "colourfulness less the truth's"}};
  std::string html = "<h3>Each view</h3>" + legend(cells);
  const int seed = cells.front().seed;
  for (const Number& wanted : kNumbers) {
    std::vector<PlotPoint> points;
    std::size_t positions = 1;
    for (const ComparisonCell& cell : cells) {
      if (cell.capture != capture || cell.seed != seed) continue;
      positions = std::max(positions, cell.metrics.views.size());
      for (std::size_t v = 0; v < cell.metrics.views.size(); ++v) {
        ViewMetrics::visit(cell.metrics.views[v], [&](const char* name, const std::optional<double>& value) {
          if (std::string_view(name) == wanted.name && value) {
            points.push_back({cell.method, cell.metrics.views[v].view, double(v), *value, 0});
          }
        });
      }
    }
    html += plot(wanted.title, points, positions);
  }
  return html;
}

/// Means and confidence intervals over seeds; nothing with a single one.
std::string seed_plots(std::span<const ComparisonCell> cells, const std::string& capture) {
  const std::vector<ComparisonRow> rows = table_rows(cells, capture);
  const bool has_seeds = std::ranges::any_of(
      rows, [](const ComparisonRow& row) { return row.columns.front() && row.columns.front()->n > 1; });
  if (!has_seeds) return "";
  std::string html = "<h3>Over seeds: mean and 95 % confidence interval</h3>";
  const auto columns = comparison_columns();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (columns[c].better == 0) continue;
    std::vector<PlotPoint> points;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      const auto& value = rows[r].columns[c];
      if (value) points.push_back({rows[r].method, "mean", double(r), value->mean, value->half_width});
    }
    html += plot(columns[c].title, points, rows.size());
  }
  return html;
}

std::string figure(const std::string& id, const EncodedPicture& picture, const std::string& caption) {
  return fmt::format("<figure><img id=\"{}\" alt=\"{}\" src=\"{}\"><figcaption>{}</figcaption></figure>", html_text(id),
                     html_text(caption), data_uri(picture), html_text(caption));
}

std::string options_html(const std::vector<std::string>& values, const std::string& selected) {
  std::string html;
  for (const std::string& value : values) {
    html += fmt::format("<option{}>{}</option>", value == selected ? " selected" : "", html_text(value));
  }
  return html;
}

std::string slider_html(const ReportCapture& capture) {
  std::vector<std::string> names = {"input"};
  if (!capture.truths.empty()) names.emplace_back("truth");
  for (const ReportMethod& method : capture.methods) {
    if (!method.views.empty()) names.push_back(method.name);
  }
  return fmt::format(
      "<div class=\"compare\" data-capture=\"{}\"><p>View <select>{}</select> left <select>{}</select> right "
      "<select>{}</select></p><div class=\"slider\"><img alt=\"right\"><img class=\"over\" alt=\"left\">"
      "<input type=\"range\" value=\"50\" aria-label=\"where the pictures meet\"></div></div>",
      html_text(capture.name), options_html(capture.view_names, ""), options_html(names, "input"),
      options_html(names, "colornerf"));
}

std::string pictures_html(const ReportCapture& capture) {
  std::string html;
  for (std::size_t v = 0; v < capture.view_names.size(); ++v) {
    const std::string place = capture.name + "/" + capture.view_names[v] + "/";
    html += "<h4>" + html_text(capture.view_names[v]) + "</h4><div class=\"pictures\">";
    html += figure(place + "input", capture.inputs[v], "input");
    for (const ReportMethod& method : capture.methods) {
      if (v < method.views.size()) html += figure(place + method.name, method.views[v], method.name);
    }
    if (v < capture.truths.size()) html += figure(place + "truth", capture.truths[v], "truth");
    html += "</div>";
  }
  return html;
}

std::string turntables_html(const ReportCapture& capture) {
  std::string figures;
  for (const ReportMethod& method : capture.methods) {
    if (method.turntable.empty()) continue;
    nlohmann::json frames = nlohmann::json::array();
    for (const EncodedPicture& frame : method.turntable) frames.push_back(data_uri(frame));
    figures += "<figure><img alt=\"turntable\"><script type=\"application/json\">" + frames.dump() +
               "</script><figcaption>" + html_text(method.name) + "</figcaption></figure>";
  }
  if (figures.empty()) return "";
  return fmt::format(
      "<h3>Turntables</h3><div><p><button>Play</button> <input type=\"range\" value=\"0\" min=\"0\"></p>"
      "<div class=\"pictures turntables\" data-fps=\"{}\">{}</div></div>",
      capture.frames_per_second, figures);
}

std::string galleries_html(std::span<const ComparisonCell> cells, const ReportCapture& capture) {
  std::string html;
  for (const ReportMethod& method : capture.methods) {
    if (method.galleries.empty()) continue;
    int accepted = 0, asked = 0;
    for (const ComparisonCell& cell : cells) {
      if (cell.capture != capture.name || cell.method != method.name) continue;
      accepted += cell.accepted;
      asked += cell.accepted + cell.rejected;
    }
    html += fmt::format("<details><summary>{}: {} of {} answers accepted</summary>", html_text(method.name), accepted,
                        asked);
    for (const ReportMethod::Gallery& gallery : method.galleries) html += figure("", gallery.picture, gallery.title);
    html += "</details>";
  }
  return html.empty() ? "" : "<h3>Purification</h3>" + html;
}

std::string capture_html(std::span<const ComparisonCell> cells, const ReportCapture& capture) {
  return "<h2>" + html_text(capture.name) + "</h2>" + table_html(table_rows(cells, capture.name)) +
         slider_html(capture) + "<h3>Held-out views</h3>" + pictures_html(capture) + turntables_html(capture) +
         view_plots(cells, capture.name) + seed_plots(cells, capture.name) + galleries_html(cells, capture);
}

std::string races_html(std::span<const ComparisonCell> cells) {
  const std::vector<TrainingRace> races = training_races(cells);
  if (races.empty()) return "";
  std::string html =
      "<h2>Training times</h2><p>On the same held-out pixels while they train: PSNR of luminance (dB) in stage 1, ab "
      "error in stage 2.</p><div class=\"wide\"><table><tr><th>Capture</th><th>Stage</th><th>Hash grid, s</th>"
      "<th>comes to</th><th>MLP, s</th><th>comes to</th><th>as good after, s</th><th>hash grid after 1/10 of the "
      "MLP's time</th></tr>";
  for (const TrainingRace& race : races) {
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{:.1f}</td><td>{:.2f}</td><td>{:.1f}</td><td>{:.2f}</td><td>{}</td>"
        "<td>{:.2f}</td></tr>",
        html_text(race.capture), race.stage, race.grid_seconds, race.grid_value, race.field_seconds, race.field_value,
        race.reached > 0 ? fmt::format("{:.1f} ({} of {} seeds)", race.reached_after, race.reached, race.seeds)
                         : "never",
        race.grid_after_tenth);
  }
  return html + "</table></div>";
}

std::string methods_html(std::span<const ComparisonCell> cells) {
  std::string html = "<h2>Methods</h2><ul>";
  for (const Method& method : kMethods) {
    if (std::ranges::find(cells, std::string(method.name), &ComparisonCell::method) == cells.end()) continue;
    html += fmt::format("<li><code>{}</code>: {}</li>", method.name, html_text(method.summary));
  }
  return html + "</ul>";
}

}  // namespace

std::string data_uri(const EncodedPicture& picture) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string uri = "data:image/" + picture.type + ";base64,";
  const auto byte = [&](std::size_t i) {
    return i < picture.bytes.size() ? std::to_integer<std::uint32_t>(picture.bytes[i]) : 0u;
  };
  for (std::size_t i = 0; i < picture.bytes.size(); i += 3) {
    const std::uint32_t three = byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2);
    for (int digit = 0; digit < 4; ++digit) {
      const bool is_padding = i + std::size_t(digit) > picture.bytes.size();
      uri += is_padding ? '=' : kDigits[three >> (18 - 6 * digit) & 63];
    }
  }
  return uri;
}

std::string html_text(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string comparison_html(std::span<const ComparisonCell> cells, const ComparisonSummary& summary,
                            std::span<const ReportCapture> captures) {
  std::string body =
      "<h1>Methods compared</h1><p>Colorizer: <code>" + html_text(summary.colorizer) +
      "</code>. LPIPS: " + (summary.lpips.empty() ? "not measured (--lpips-weights)" : html_text(summary.lpips)) +
      ". Made by <code>" + html_text(summary.command_line) + "</code>.</p>";
  if (captures.size() > 1) body += "<h2>All captures</h2>" + table_html(table_rows(cells, "")) + seed_plots(cells, "");
  for (const ReportCapture& capture : captures) body += capture_html(cells, capture);
  body += duels_html(cells) + races_html(cells) + methods_html(cells) + "<h2>The paper's table</h2>" + kPaperTable +
          "<h2>What the numbers mean</h2><ul>";
  for (const ComparisonColumn& column : comparison_columns()) {
    body += "<li><b>" + html_text(column.title) + "</b>: " + html_text(column.help) + "</li>";
  }
  body += "<li><b>±</b>: 95 % confidence interval of the mean over seeds (Student's t)</li></ul>";
  return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
         "content=\"width=device-width\">" +
         element("title", "cnerf: methods compared") + element("style", kStyle) + "</head><body>" + body +
         element("script", kScript) + "</body></html>\n";
}

}  // namespace cnerf::compare

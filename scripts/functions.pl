#!/usr/bin/env perl
# Lists C++ functions with their sizes:  scripts/functions.pl FILE... > "lines parameters file:line name". CUDA kernels and
# lambdas are left out; a lambda counts as part of its function.
use strict;
use warnings;

my $control = qr/^(if|for|while|switch|catch|return|sizeof|alignas|alignof|decltype|noexcept|static_assert|requires)$/;
my $parens;
$parens = qr/\((?:[^()]++|(??{$parens}))*+\)/;

for my $file (@ARGV) {
  open(my $in, '<', $file) or die "$file: $!";
  local $/;
  my $text = <$in>;
  # Comments and literals become blanks of the same lines.
  $text =~ s{(//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\g2"|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)')}
            {my $t = $1; $t =~ s/[^\n]/ /g; $t}gsex;
  $text =~ s/^#.*(?:\\\n.*)*$/ /mg;
  while ($text =~ /([\w~]+(?:::[\w~]+|<\w+>)*|operator\s*\S+?)\s*($parens)((?:\s*(?:const|noexcept|override|final|&&?|->\s*[\w:<>,&* ]+))*)(\s*:\s[^;{}]*?(?:\{[^{}]*\}[^;{}]*?)*?)?\s+\{/g) {
    my ($name, $parameters) = ($1, $2);
    my ($begin, $end) = ($-[1], pos($text));
    next if $name =~ $control;
    my $before = substr($text, $begin > 200 ? $begin - 200 : 0, $begin > 200 ? 200 : $begin);
    $before =~ s/.*[;{}]//s;
    next if $before =~ /__global__|__launch_bounds__/;
    my $depth = 1;
    my $at = $end;
    while ($depth > 0 && substr($text, $at) =~ /[{}]/) {
      $at += $+[0];
      $depth += substr($text, $at - 1, 1) eq '{' ? 1 : -1;
    }
    my $lines = 1 + (substr($text, $begin, $at - $begin) =~ tr/\n//);
    $parameters =~ s/^\(|\)$//g;
    1 while $parameters =~ s/<[^<>]*>|\([^()]*\)|\{[^{}]*\}|\[[^\[\]]*\]//;
    my $count = $parameters =~ /^\s*(void)?\s*$/ ? 0 : 1 + ($parameters =~ tr/,//);
    my $line = 1 + (substr($text, 0, $begin) =~ tr/\n//);
    print "$lines $count $file:$line $name\n";
  }
}

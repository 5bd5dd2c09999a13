(* From the field of a closed loop and a function V to the polynomials that must be nowhere negative.

   States x_0, x_1, ...; a power of one is |x|^a, odd if times the sign of x. Where no state is zero, V has partial
   derivatives D_i, and what is proved is about sum of D_i * f_i, for all parameters in their ranges. *)

(* ---------------------------------------------------------------- powers *)

(* c times parameters, by their indices, times a power of every state: exponent, and whether it is odd. *)
Record monomial_term : Set := Monomial { number : Q; parameters : list nat; powers : list (Q * bool) }.
Definition expression := list monomial_term.

Definition sign (x : R) : R := if Rle_dec 0 x then 1 else -1.
Definition signed_power (x : R) (p : Q * bool) : R := (if snd p then sign x else 1) * Rpower (Rabs x) (Q2R (fst p)).
Fixpoint powers_value (x : nat -> R) (k : nat) (l : list (Q * bool)) : R :=
  match l with nil => 1 | p :: l => signed_power (x k) p * powers_value x (S k) l end.
Definition parameters_value (p : nat -> R) (l : list nat) : R := fold_right (fun i total => p i * total) 1 l.
Definition term_value (x p : nat -> R) (t : monomial_term) : R :=
  Q2R (number t) * parameters_value p (parameters t) * powers_value x 0 (powers t).
Definition expression_value (x p : nat -> R) (e : expression) : R :=
  fold_right (fun t total => term_value x p t + total) 0 e.

Fixpoint product_of_powers (a b : list (Q * bool)) : list (Q * bool) :=
  match a, b with
  | (q, o) :: a, (r, n) :: b => (Qred (q + r), xorb o n) :: product_of_powers a b
  | nil, b => b
  | a, nil => a
  end.
Definition product_of_terms (s t : monomial_term) : monomial_term :=
  Monomial (Qred (number s * number t)) (parameters s ++ parameters t) (product_of_powers (powers s) (powers t)).
Definition product_of (a b : expression) : expression := flat_map (fun s => map (product_of_terms s) b) a.

(* d|x|^a = a |x|^(a - 1) sign x, d(sign x |x|^a) = a |x|^(a - 1). *)
Fixpoint lowered (i : nat) (l : list (Q * bool)) {struct l} : Q * list (Q * bool) :=
  match l, i with
  | nil, _ => (0%Q, nil)
  | (a, o) :: l, O => (a, (Qred (a - 1), negb o) :: l)
  | p :: l, S i => let (c, l) := lowered i l in (c, p :: l)
  end.
Definition partial (i : nat) (e : expression) : expression :=
  flat_map (fun t => let (c, l) := lowered i (powers t) in
                     if Qeq_bool c 0 then nil else [Monomial (Qred (c * number t)) (parameters t) l]) e.
Fixpoint rate_from (i : nat) (v : expression) (field : list expression) : expression :=
  match field with nil => nil | f :: field => product_of (partial i v) f ++ rate_from (S i) v field end.

Lemma sign_square x : sign x * sign x = 1.
Proof. unfold sign. destruct (Rle_dec 0 x); ring. Qed.

Lemma signed_power_product x a o b n : signed_power x (a, o) * signed_power x (b, n) = signed_power x (Qred (a + b), xorb o n).
Proof.
  unfold signed_power; cbn [fst snd]. rewrite red_value, Q2R_plus, Rpower_plus. pose proof (sign_square x) as s.
  destruct o, n; cbn [xorb]; try ring.
  transitivity (sign x * sign x * (Rpower (Rabs x) (Q2R a) * Rpower (Rabs x) (Q2R b))); [ring | rewrite s; ring].
Qed.

Lemma powers_value_product x : forall a b k,
  powers_value x k (product_of_powers a b) = powers_value x k a * powers_value x k b.
Proof.
  induction a as [| [q o] a H]; intros [| [r n] b] k; cbn [product_of_powers powers_value]; try ring.
  rewrite H, <- signed_power_product. ring.
Qed.

Lemma parameters_value_app p a b : parameters_value p (a ++ b) = parameters_value p a * parameters_value p b.
Proof. unfold parameters_value. induction a as [| i a H]; cbn; [ring | rewrite H; ring]. Qed.

Lemma term_value_product x p s t : term_value x p (product_of_terms s t) = term_value x p s * term_value x p t.
Proof.
  unfold term_value, product_of_terms; cbn [number parameters powers].
  rewrite red_value, Q2R_mult, parameters_value_app, powers_value_product. ring.
Qed.

Lemma expression_value_cons x p t e : expression_value x p (t :: e) = term_value x p t + expression_value x p e.
Proof. reflexivity. Qed.

Lemma expression_value_app x p a b : expression_value x p (a ++ b) = expression_value x p a + expression_value x p b.
Proof. unfold expression_value. induction a as [| t a H]; cbn; [ring | rewrite H; ring]. Qed.

Lemma expression_value_product x p a b : expression_value x p (product_of a b) = expression_value x p a * expression_value x p b.
Proof.
  unfold product_of. induction a as [| s a H]; [cbn; ring |]. cbn [flat_map].
  rewrite expression_value_app, H, expression_value_cons.
  enough (expression_value x p (map (product_of_terms s) b) = term_value x p s * expression_value x p b) as -> by ring.
  clear H. induction b as [| t b H]; [cbn; ring |]. cbn [map]. rewrite !expression_value_cons, H, term_value_product. ring.
Qed.

(* ---------------------------------------------------------------- derivatives *)

Definition update (x : nat -> R) (i : nat) (t : R) (k : nat) : R := if Nat.eqb k i then t else x k.

Lemma locally_equal f g x l d : 0 < d -> (forall t, Rabs (t - x) < d -> f t = g t) -> derivable_pt_lim g x l -> derivable_pt_lim f x l.
Proof.
  intros pos same lim eps he. destruct (lim eps he) as [[e pe] H]. assert (pm : 0 < Rmin e d) by (apply Rmin_glb_lt; assumption).
  exists (mkposreal _ pm). intros h nz small. cbn in small, H.
  rewrite (same (x + h)), (same x).
  - apply H; [exact nz |]. eapply Rlt_le_trans; [exact small | apply Rmin_l].
  - rewrite Rminus_diag_eq, Rabs_R0 by reflexivity. exact pos.
  - replace (x + h - x) with h by ring. eapply Rlt_le_trans; [exact small | apply Rmin_r].
Qed.

Lemma signed_power_derivative x a o : x <> 0 ->
  derivable_pt_lim (fun t => signed_power t (a, o)) x (Q2R a * signed_power x (Qred (a - 1), negb o)).
Proof.
  intro nz. unfold signed_power; cbn [fst snd]. rewrite red_value.
  assert (low : Q2R (a - 1) = Q2R a - 1) by (rewrite Q2R_minus; unfold Q2R; cbn; lra). rewrite low.
  assert (pos : 0 < Rabs x) by (now apply Rabs_pos_lt).
  destruct (Rlt_le_dec 0 x) as [gt | le].
  - apply locally_equal with (g := fun t => Rpower t (Q2R a)) (d := x); [exact gt | |].
    + intros t near. apply Rabs_def2 in near. unfold sign. rewrite Rabs_right by lra.
      destruct (Rle_dec 0 t); [| lra]. destruct o; ring.
    + unfold sign. destruct (Rle_dec 0 x); [| lra]. rewrite Rabs_right by lra.
      replace (Q2R a * _) with (Q2R a * Rpower x (Q2R a - 1)) by (destruct o; cbn; ring). now apply derivable_pt_lim_power.
  - assert (neg : x < 0) by lra.
    apply locally_equal with (g := fun t => (if o then -1 else 1) * Rpower (- t) (Q2R a)) (d := - x); [lra | |].
    + intros t near. apply Rabs_def2 in near. unfold sign. rewrite Rabs_left by lra.
      destruct (Rle_dec 0 t); [lra |]. destruct o; ring.
    + unfold sign. destruct (Rle_dec 0 x); [lra |]. rewrite Rabs_left by lra.
      replace (Q2R a * _) with ((if o then -1 else 1) * ((Q2R a * Rpower (- x) (Q2R a - 1)) * - (1))) by (destruct o; cbn; ring).
      apply (derivable_pt_lim_scal (fun t => Rpower (- t) (Q2R a))).
      apply (derivable_pt_lim_comp (fun t => - t) (fun t => Rpower t (Q2R a))).
      * apply (derivable_pt_lim_opp id), derivable_pt_lim_id.
      * apply derivable_pt_lim_power. lra.
Qed.

Lemma powers_value_update_other x i t : forall l k, (i < k)%nat -> powers_value (update x i t) k l = powers_value x k l.
Proof.
  induction l as [| p l H]; intros k less; cbn; [reflexivity |]. rewrite H by lia. unfold update at 1.
  destruct (Nat.eqb_spec k i); [lia | reflexivity].
Qed.

Lemma powers_value_derivative x : (forall k, x k <> 0) -> forall l i k,
  derivable_pt_lim (fun t => powers_value (update x (k + i) t) k l) (x (k + i)%nat)
    (let (c, m) := lowered i l in Q2R c * powers_value x k m).
Proof.
  intro nz. induction l as [| [a o] l H]; intros i k; cbn [lowered powers_value].
  - replace (Q2R 0 * 1) with 0 by (unfold Q2R; cbn; ring). apply derivable_pt_lim_const.
  - destruct i as [| i].
    + rewrite Nat.add_0_r. cbn [powers_value].
      apply locally_equal with (g := fun t => powers_value x (S k) l * signed_power t (a, o)) (d := 1); [lra | |].
      * intros t _. rewrite powers_value_update_other by lia. unfold update. rewrite Nat.eqb_refl. ring.
      * replace (Q2R a * _) with (powers_value x (S k) l * (Q2R a * signed_power (x k) (Qred (a - 1), negb o))) by ring.
        apply (derivable_pt_lim_scal (fun t => signed_power t (a, o))). now apply signed_power_derivative.
    + specialize (H i (S k)). destruct (lowered i l) as [c m]. cbn [powers_value].
      replace (k + S i)%nat with (S k + i)%nat by lia.
      apply locally_equal with (g := fun t => signed_power (x k) (a, o) * powers_value (update x (S k + i) t) (S k) l) (d := 1).
      * lra.
      * intros t _. unfold update at 1. destruct (Nat.eqb_spec k (S k + i)); [lia | reflexivity].
      * replace (Q2R c * _) with (signed_power (x k) (a, o) * (Q2R c * powers_value x (S k) m)) by ring.
        apply (derivable_pt_lim_scal (fun t => powers_value (update x (S k + i) t) (S k) l)). exact H.
Qed.

Lemma expression_derivative x p i e : (forall k, x k <> 0) ->
  derivable_pt_lim (fun t => expression_value (update x i t) p e) (x i) (expression_value x p (partial i e)).
Proof.
  intro nz. induction e as [| t e H]; [apply derivable_pt_lim_const |].
  change (partial i (t :: e)) with ((let (c, l) := lowered i (powers t) in
    if Qeq_bool c 0 then nil else [Monomial (Qred (c * number t)) (parameters t) l]) ++ partial i e).
  rewrite expression_value_app.
  apply (derivable_pt_lim_plus (fun s => term_value (update x i s) p t)); [| exact H].
  pose proof (powers_value_derivative x nz (powers t) i 0) as D. cbn [Nat.add] in D.
  destruct (lowered i (powers t)) as [c m].
  replace (expression_value x p _) with (Q2R (number t) * parameters_value p (parameters t) * (Q2R c * powers_value x 0 m)).
  2: { destruct (Qeq_bool c 0) eqn:zero.
       - apply Qeq_bool_iff, Qeq_eqR in zero. rewrite zero. unfold Q2R; cbn. field. apply IZR_neq; lia.
       - rewrite expression_value_cons. unfold term_value; cbn [number parameters powers].
         rewrite red_value, Q2R_mult. cbn. ring. }
  apply (derivable_pt_lim_scal (fun s => powers_value (update x i s) 0 (powers t))). exact D.
Qed.

(* Sum of D_i * f_i, i = k, k + 1, ... *)
Fixpoint along_field (d : nat -> R) (x p : nat -> R) (k : nat) (field : list expression) : R :=
  match field with nil => 0 | f :: field => d k * expression_value x p f + along_field d x p (S k) field end.

Lemma rate_value x p v d : (forall k, x k <> 0) ->
  (forall i, derivable_pt_lim (fun t => expression_value (update x i t) p v) (x i) (d i)) ->
  forall field k, expression_value x p (rate_from k v field) = along_field d x p k field.
Proof.
  intros nz der. induction field as [| f field H]; intro k; cbn [rate_from along_field]; [reflexivity |].
  rewrite expression_value_app, expression_value_product, H.
  rewrite (uniqueness_limite _ _ _ _ (der k) (expression_derivative x p k v nz)). reflexivity.
Qed.

(* ---------------------------------------------------------------- cells *)

(* x_k = +-u_k^r with u_k > 0; a column has the weight r and says whether its state is positive anyhow. *)
Record column : Set := Column { weight : positive; positive_only : bool }.

Fixpoint in_cell (x u : nat -> R) (k : nat) (signs : list bool) (columns : list column) : Prop :=
  match signs, columns with
  | s :: signs, c :: columns =>
      (if s then x k < 0 else 0 < x k) /\ u k = Rpower (Rabs (x k)) (/ IZR (Zpos (weight c))) /\ in_cell x u (S k) signs columns
  | nil, nil => True
  | _, _ => False
  end.

Fixpoint cell_powers (signs : list bool) (columns : list column) (l : list (Q * bool)) : option (bool * list nat) :=
  match l, signs, columns with
  | nil, _, _ => Some (false, nil)
  | (a, o) :: l, s :: signs, c :: columns =>
      let e := Qred (a * (Zpos (weight c) # 1)) in
      if (Qden e =? 1)%positive && (0 <=? Qnum e)%Z
      then match cell_powers signs columns l with
           | Some (n, rest) => Some (xorb (o && s) n, Z.to_nat (Qnum e) :: rest)
           | None => None
           end
      else None
  | _, _, _ => None
  end.
Definition vertex_value (v : list Q) (l : list nat) : Q := fold_right (fun i total => Qred (nth i v 0 * total)%Q) 1%Q l.
Fixpoint cell_polynomial (signs : list bool) (columns : list column) (v : list Q) (e : expression) : option polynomial :=
  match e with
  | nil => Some nil
  | t :: e =>
      match cell_powers signs columns (powers t), cell_polynomial signs columns v e with
      | Some (n, exponents), Some p =>
          let c := Qred (number t * vertex_value v (parameters t)) in Some ((if n then Qopp c else c, exponents) :: p)
      | _, _ => None
      end
  end.

Definition at_vertex (v : list Q) (i : nat) : R := Q2R (nth i v 0%Q).

Lemma value_of_vertex v l : Q2R (vertex_value v l) = parameters_value (at_vertex v) l.
Proof.
  unfold vertex_value, parameters_value. induction l as [| i l H]; cbn [fold_right]; [unfold Q2R; cbn; field |].
  now rewrite red_value, Q2R_mult, H.
Qed.

Lemma power_in_cell x u s a o r n : (if s : bool then x < 0 else 0 < x) -> u = Rpower (Rabs x) (/ IZR (Zpos r)) ->
  Q2R a * IZR (Zpos r) = INR n -> signed_power x (a, o) = (if o && s then -1 else 1) * u ^ n.
Proof.
  intros cell -> exact_. assert (pr : 0 < IZR (Zpos r)) by now apply IZR_lt.
  assert (exponent : Q2R a = / IZR (Zpos r) * INR n) by (rewrite <- exact_; field; lra).
  rewrite <- Rpower_pow by (apply exp_pos). rewrite Rpower_mult, <- exponent.
  unfold signed_power, sign; cbn [fst snd]. destruct s; destruct (Rle_dec 0 x); try lra; destruct o; cbn; ring.
Qed.

Lemma value_cell_powers x u : forall l signs columns k n es, cell_powers signs columns l = Some (n, es) ->
  in_cell x u k signs columns -> powers_value x k l = (if n then -1 else 1) * monomial_value u k es.
Proof.
  induction l as [| [a o] l H]; intros [| s signs] [| c columns] k n es some cell; cbn [cell_powers in_cell] in *; try discriminate;
    try (injection some as <- <-; cbn; ring).
  destruct cell as (sg & root & rest). set (e := Qred (a * (Zpos (weight c) # 1))) in *.
  destruct ((Qden e =? 1)%positive && (0 <=? Qnum e)%Z) eqn:whole_e; [| discriminate].
  apply andb_prop in whole_e as [one pos]. apply Pos.eqb_eq in one. apply Z.leb_le in pos.
  destruct (cell_powers signs columns l) as [[m r] |] eqn:more; [| discriminate]. injection some as <- <-.
  cbn [powers_value monomial_value]. rewrite (H _ _ _ _ _ more rest).
  rewrite (power_in_cell (x k) (u k) s a o (weight c) (Z.to_nat (Qnum e)) sg root).
  - destruct (o && s), m; cbn; ring.
  - rewrite INR_IZR_INZ, Z2Nat.id by exact pos.
    assert (v : Q2R e = IZR (Qnum e)) by (unfold Q2R; rewrite one; field).
    rewrite <- v. unfold e. rewrite red_value, Q2R_mult. unfold Q2R at 3; cbn. field.
Qed.

Lemma value_cell_polynomial x u signs columns v : in_cell x u 0 signs columns ->
  forall e p, cell_polynomial signs columns v e = Some p -> at_point u p = expression_value x (at_vertex v) e.
Proof.
  intro cell. induction e as [| t e H]; intros p some; cbn [cell_polynomial] in some; [injection some as <-; reflexivity |].
  destruct (cell_powers signs columns (powers t)) as [[n es] |] eqn:one; [| discriminate].
  destruct (cell_polynomial signs columns v e) as [q |]; [| discriminate]. injection some as <-.
  rewrite expression_value_cons, <- (H q eq_refl). unfold term_value. rewrite (value_cell_powers _ _ _ _ _ _ _ _ one cell).
  set (c := Qred (number t * vertex_value v (parameters t))).
  assert (val : Q2R c = Q2R (number t) * parameters_value (at_vertex v) (parameters t))
    by (unfold c; now rewrite red_value, Q2R_mult, value_of_vertex).
  destruct n.
  - change (Q2R (- c) * monomial_value u 0 es + at_point u q = Q2R (number t) * parameters_value (at_vertex v) (parameters t) *
      (-1 * monomial_value u 0 es) + at_point u q). rewrite Q2R_opp, val. ring.
  - change (Q2R c * monomial_value u 0 es + at_point u q = Q2R (number t) * parameters_value (at_vertex v) (parameters t) *
      (1 * monomial_value u 0 es) + at_point u q). rewrite val. ring.
Qed.

(* ---------------------------------------------------------------- ranges of parameters *)

Fixpoint vertices (ranges : list (Q * Q)) : list (list Q) :=
  match ranges with
  | nil => [nil]
  | (low, high) :: ranges =>
      map (cons low) (vertices ranges) ++ (if Qeq_bool low high then nil else map (cons high) (vertices ranges))
  end.
Fixpoint distinct (l : list nat) : bool :=
  match l with nil => true | i :: l => negb (existsb (Nat.eqb i) l) && distinct l end.
Definition affine (e : expression) : bool := forallb (fun t => distinct (parameters t)) e.

Lemma parameters_value_same p q l : (forall i, p i = q i) -> parameters_value p l = parameters_value q l.
Proof. intro same. unfold parameters_value. induction l as [| i l H]; cbn; [reflexivity | now rewrite H, same]. Qed.

Lemma expression_value_same x p q e : (forall i, p i = q i) -> expression_value x p e = expression_value x q e.
Proof.
  intro same. induction e as [| t e H]; [reflexivity |]. rewrite !expression_value_cons, H. unfold term_value.
  now rewrite (parameters_value_same p q _ same).
Qed.

Lemma parameters_affine p j l : distinct l = true ->
  exists a b, forall t, parameters_value (update p j t) l = a + b * t /\ (existsb (Nat.eqb j) l = false -> b = 0).
Proof.
  unfold parameters_value. induction l as [| i l H]; intro d; cbn [distinct fold_right existsb] in *.
  - exists 1, 0. intro; split; [ring | reflexivity].
  - apply andb_prop in d as [new d]. destruct (H d) as (a & b & ab). unfold update at 1. destruct (Nat.eqb_spec i j) as [-> | ne].
    + exists 0, a. intro t. rewrite Nat.eqb_refl. destruct (ab t) as [-> zero]. split; [| discriminate].
      apply negb_true_iff in new. rewrite (zero new). ring.
    + exists (p i * a), (p i * b). intro t. destruct (ab t) as [-> zero]. split; [ring |].
      intro none. apply orb_false_elim in none as [_ none]. rewrite (zero none). ring.
Qed.

Lemma expression_affine x p j e : affine e = true -> exists a b, forall t, expression_value x (update p j t) e = a + b * t.
Proof.
  induction e as [| t e H]; intro d.
  - exists 0, 0. intro; cbn; ring.
  - cbn in d. apply andb_prop in d as [dt de]. destruct (H de) as (a & b & ab).
    destruct (parameters_affine p j (parameters t) dt) as (c & d & cd).
    exists (Q2R (number t) * powers_value x 0 (powers t) * c + a), (Q2R (number t) * powers_value x 0 (powers t) * d + b).
    intro s. rewrite expression_value_cons, ab. unfold term_value. destruct (cd s) as [-> _]. ring.
Qed.

Definition listed (l : list R) (i : nat) : R := nth i l 0.
Fixpoint in_ranges (l : list R) (ranges : list (Q * Q)) : Prop :=
  match l, ranges with
  | t :: l, (low, high) :: ranges => Q2R low <= t <= Q2R high /\ in_ranges l ranges
  | nil, nil => True
  | _, _ => False
  end.

Lemma listed_middle pre t rest : forall i, listed (pre ++ t :: rest) i = update (listed (pre ++ 0 :: rest)) (length pre) t i.
Proof.
  intro i. unfold listed, update. destruct (Nat.eqb_spec i (length pre)) as [-> | ne].
  - now rewrite app_nth2, Nat.sub_diag by lia.
  - destruct (Nat.lt_ge_cases i (length pre)) as [less | more].
    + now rewrite !app_nth1 by lia.
    + rewrite !app_nth2 by lia. destruct (i - length pre)%nat eqn:eq; [lia | reflexivity].
Qed.

Lemma ends_decide x e : affine e = true -> forall ranges pre,
  (forall v, In v (vertices ranges) -> 0 <= expression_value x (listed (pre ++ map Q2R v)) e) ->
  forall l, in_ranges l ranges -> 0 <= expression_value x (listed (pre ++ l)) e.
Proof.
  intro aff. induction ranges as [| [low high] ranges H]; intros pre at_ends [| t l] inside; cbn in inside; try contradiction.
  - apply (at_ends nil). now left.
  - destruct inside as [[lt th] inside].
    assert (below : 0 <= expression_value x (listed ((pre ++ [Q2R low]) ++ l)) e).
    { apply H; [| exact inside]. intros v here. rewrite <- app_assoc. apply (at_ends (low :: v)). cbn [vertices].
      apply in_or_app. left. now apply in_map. }
    assert (above : 0 <= expression_value x (listed ((pre ++ [Q2R high]) ++ l)) e).
    { cbn [vertices] in at_ends. destruct (Qeq_bool low high) eqn:eq.
      - apply Qeq_bool_iff, Qeq_eqR in eq. rewrite <- eq. exact below.
      - apply H; [| exact inside]. intros v here. rewrite <- app_assoc. apply (at_ends (high :: v)).
        apply in_or_app. right. now apply in_map. }
    rewrite <- app_assoc in below, above. cbn [app] in below, above.
    destruct (expression_affine x (listed (pre ++ 0 :: l)) (length pre) e aff) as (a & b & ab).
    rewrite (expression_value_same _ _ _ _ (listed_middle pre (Q2R low) l)), ab in below.
    rewrite (expression_value_same _ _ _ _ (listed_middle pre (Q2R high) l)), ab in above.
    rewrite (expression_value_same _ _ _ _ (listed_middle pre t l)), ab.
    destruct (Rle_lt_dec 0 b); nra.
Qed.

(* Where no parameter is negative, every term at the ends of the ranges where it is largest on a cell. *)
Definition ends (signs : list bool) (columns : list column) (ranges : list (Q * Q)) (t : monomial_term) : list Q :=
  match cell_powers signs columns (powers t) with
  | Some (n, _) => if Bool.eqb n (Qnum (number t) <? 0)%Z then map snd ranges else map fst ranges
  | None => nil
  end.
Fixpoint at_most (signs : list bool) (columns : list column) (ranges : list (Q * Q)) (e : expression) : option polynomial :=
  match e with
  | nil => Some nil
  | t :: e => match cell_polynomial signs columns (ends signs columns ranges t) [t], at_most signs columns ranges e with
              | Some a, Some p => Some (a ++ p)
              | _, _ => None
              end
  end.
Definition not_negative (ranges : list (Q * Q)) (e : expression) : bool :=
  forallb (fun t => forallb (fun i => Qle_bool 0 (nth i (map fst ranges) 0%Q)) (parameters t)) e.

Lemma between : forall ranges l, in_ranges l ranges -> forall i,
  at_vertex (map fst ranges) i <= listed l i <= at_vertex (map snd ranges) i.
Proof.
  assert (zero : Q2R 0 = 0) by (unfold Q2R; cbn; field).
  induction ranges as [| [low high] ranges H]; intros [| t l] inside i; cbn in inside; try contradiction.
  - unfold at_vertex, listed. destruct i; cbn; lra.
  - destruct inside as [here more]. destruct i as [| i]; [exact here | exact (H l more i)].
Qed.

Lemma parameters_between ranges l q : in_ranges l ranges ->
  forallb (fun i => Qle_bool 0 (nth i (map fst ranges) 0%Q)) q = true ->
  0 <= parameters_value (at_vertex (map fst ranges)) q <= parameters_value (listed l) q /\
  parameters_value (listed l) q <= parameters_value (at_vertex (map snd ranges)) q.
Proof.
  intro inside. unfold parameters_value. induction q as [| i q H]; cbn [forallb fold_right]; intro pos; [lra |].
  apply andb_prop in pos as [pi pq]. destruct (H pq) as [[h0 h1] h2]. destruct (between _ _ inside i) as [b1 b2].
  apply Qle_bool_iff, Qle_Rle in pi. replace (Q2R 0) with 0 in pi by (unfold Q2R; cbn; field).
  fold (at_vertex (map fst ranges) i) in pi. repeat split; [apply Rmult_le_pos; assumption | |]; apply Rmult_le_compat; lra.
Qed.

Lemma monomial_positive u : (forall k, 0 < u k) -> forall l k, 0 < monomial_value u k l.
Proof.
  intro pos. induction l as [| n l H]; intro k; cbn; [lra |]. apply Rmult_lt_0_compat; [now apply pow_lt | apply H].
Qed.

Lemma at_point_app u a b : at_point u (a ++ b) = at_point u a + at_point u b.
Proof. unfold at_point. induction a as [| c a H]; cbn; [ring | rewrite H; ring]. Qed.

Lemma value_at_most x u signs columns ranges l : in_cell x u 0 signs columns -> (forall k, 0 < u k) -> in_ranges l ranges ->
  forall e p, not_negative ranges e = true -> at_most signs columns ranges e = Some p ->
  expression_value x (listed l) e <= at_point u p.
Proof.
  intros cell pos inside. induction e as [| t e H]; intros p fine some; cbn [at_most] in some; [injection some as <-; cbn; lra |].
  cbn [not_negative forallb] in fine. apply andb_prop in fine as [ft fe].
  destruct (cell_polynomial signs columns (ends signs columns ranges t) [t]) as [a |] eqn:one; [| discriminate].
  destruct (at_most signs columns ranges e) as [q |]; [| discriminate]. injection some as <-.
  rewrite at_point_app, expression_value_cons. pose proof (H q fe eq_refl) as rest.
  rewrite (value_cell_polynomial _ _ _ _ _ cell _ _ one), expression_value_cons. cbn [expression_value fold_right].
  enough (term_value x (listed l) t <= term_value x (at_vertex (ends signs columns ranges t)) t) by lra.
  destruct (parameters_between ranges l (parameters t) inside ft) as [[low0 low] high]. unfold term_value, ends.
  cbn [cell_polynomial] in one. destruct (cell_powers signs columns (powers t)) as [[n es] |] eqn:known; [| discriminate].
  rewrite (value_cell_powers _ _ _ _ _ _ _ _ known cell). pose proof (monomial_positive u pos es 0) as mono.
  assert (size : if (Qnum (number t) <? 0)%Z then Q2R (number t) <= 0 else 0 <= Q2R (number t)).
  { pose proof (Rinv_0_lt_compat _ (IZR_lt 0 _ (Pos2Z.is_pos (Qden (number t))))) as inv. unfold Q2R.
    destruct (Z.ltb_spec (Qnum (number t)) 0) as [neg | up].
    - apply IZR_lt in neg. nra.
    - apply IZR_le in up. nra. }
  set (m := monomial_value u 0 es) in *. set (c := Q2R (number t)) in *.
  destruct n, (Qnum (number t) <? 0)%Z; cbn [Bool.eqb]; [assert (0 <= - c * m) by nra | assert (0 <= c * m) by nra |
    assert (0 <= - c * m) by nra | assert (0 <= c * m) by nra]; nra.
Qed.

(* ---------------------------------------------------------------- every cell and every end *)

(* A polynomial over its common denominator. *)
Definition prepared := (Z * tree)%type.
Definition prepare (p : polynomial) : prepared := let d := denominator p in (d, whole d p).
Definition equal (a b : prepared) : bool := is_zero (add (scale (fst b) (snd a)) (scale (- fst a) (snd b))).
Definition positive_terms (t : tree) : bool :=
  coefficients_nonnegative t && (0 <? value_at_integers (fun _ => 1%Z) 0 t)%Z.

Lemma value_prepared x p : value x 0 (snd (prepare p)) = IZR (fst (prepare p)) * at_point x p /\ 0 < IZR (fst (prepare p)).
Proof. split; [apply value_whole, Z.divide_refl | apply IZR_lt, denominator_positive]. Qed.

Lemma equal_sound x p q : equal (prepare p) (prepare q) = true -> at_point x p = at_point x q.
Proof.
  intro eq. apply (value_is_zero x _ 0) in eq. rewrite value_add, !value_scale, opp_IZR in eq.
  destruct (value_prepared x p) as [vp dp], (value_prepared x q) as [vq dq]. rewrite vp, vq in eq.
  assert (zero : IZR (fst (prepare p)) * IZR (fst (prepare q)) * (at_point x p - at_point x q) = 0) by lra.
  apply Rmult_integral in zero as [zero | zero]; [| lra]. apply Rmult_integral in zero as [zero | zero]; lra.
Qed.

Lemma positive_terms_sound x t : (forall k, 0 < x k) -> positive_terms t = true -> 0 < value x 0 t.
Proof.
  intros pos good. apply andb_prop in good as [c one]. apply (positive_inside x pos t 0 c). now apply Z.ltb_lt.
Qed.

Section Coverage.
Variable columns : list column.
Variable lifts : list (nat * expression). (* x_k = P(x) *)
Variable ranges : list (Q * Q).
Variable questions : list question.

Definition power_of (k : nat) (p : Q * bool) : list (Q * bool) := repeat (0%Q, false) k ++ [p].
Definition negated (e : expression) : expression := map (fun t => Monomial (Qopp (number t)) (parameters t) (powers t)) e.
Definition difference (lift : nat * expression) : expression :=
  Monomial 1 nil (power_of (fst lift) (1%Q, true)) :: negated (snd lift).
Definition magnitude (lift : nat * expression) : expression :=
  product_of [Monomial 1 nil (power_of (fst lift) (0%Q, true))] (snd lift).
Definition constant (e : expression) : bool := forallb (fun t => match parameters t with nil => true | _ => false end) e.

Fixpoint prepared_by (form : expression -> option polynomial) (l : list expression) : list prepared :=
  match l with
  | nil => nil
  | e :: l => match form e with
              | Some p => prepare p :: prepared_by form l
              | None => prepared_by form l
              end
  end.

Definition table := map (fun q => (q, (prepare (target q), (map prepare (inequalities q), map prepare (equalities q))))) questions.
Definition is_variable (g : polynomial) : bool :=
  match variable_of g, g with Some _, (c, _) :: _ => (Qnum c =? 1)%Z && (Qden c =? 1)%positive | _, _ => false end.
Definition matching (a : prepared) (gs hs : list prepared) entry : bool :=
  let '(q, (p, (_, equal_zero))) := entry : question * (prepared * (list prepared * list prepared)) in
  if equal a p
  then forallb (fun h => first (fun c => equal c h) hs) equal_zero &&
       forallb (fun g => if is_variable g then true else first (fun c => equal c (prepare g)) gs) (inequalities q)
  else false.
Definition covered (e : expression) (known : list (question * (prepared * (list prepared * list prepared)))) (signs : list bool) : bool :=
  let hs := prepared_by (cell_polynomial signs columns nil) (map difference (filter (fun lift => constant (snd lift)) lifts)) in
  let gs := prepared_by (at_most signs columns ranges) (map magnitude lifts) in
  if first (fun h => positive_terms (snd h) || positive_terms (scale (-1) (snd h))) hs then true
  else if first (fun g => positive_terms (scale (-1) (snd g))) gs then true
  else forallb (fun v => match cell_polynomial signs columns v e with
                         | Some p => let a := prepare p in first (matching a gs hs) known
                         | None => false
                         end) (vertices ranges).
Fixpoint all_signs (l : list column) : list (list bool) :=
  match l with
  | nil => [nil]
  | c :: l => map (cons false) (all_signs l) ++ (if positive_only c then nil else map (cons true) (all_signs l))
  end.
Definition covers (e : expression) : bool :=
  let known := table in
  affine e && forallb (fun lift => not_negative ranges (snd lift)) lifts && forallb (covered e known) (all_signs columns).

Lemma power_of_value x : forall k p j, powers_value x j (power_of k p) = signed_power (x (j + k)%nat) p.
Proof.
  unfold power_of. induction k as [| k H]; intros p j; cbn [repeat app powers_value].
  - rewrite Nat.add_0_r. ring.
  - rewrite H. replace (S j + k)%nat with (j + S k)%nat by lia. unfold signed_power at 1; cbn [fst snd].
    unfold Q2R, Rpower; cbn. replace (0 * / 1 * ln (Rabs (x j))) with 0 by field. rewrite exp_0. ring.
Qed.

Lemma first_power t : t <> 0 -> signed_power t (1%Q, true) = t.
Proof.
  intro nz. unfold signed_power, sign; cbn [fst snd]. replace (Q2R 1) with 1 by (unfold Q2R; cbn; field).
  rewrite Rpower_1 by (now apply Rabs_pos_lt). destruct (Rle_dec 0 t).
  - rewrite Rabs_right; lra.
  - rewrite Rabs_left; lra.
Qed.

Lemma zeroth_power t : signed_power t (0%Q, true) = sign t.
Proof.
  unfold signed_power; cbn [fst snd]. unfold Q2R, Rpower; cbn. replace (0 * / 1 * ln (Rabs t)) with 0 by field.
  rewrite exp_0. ring.
Qed.

Lemma negated_value x p e : expression_value x p (negated e) = - expression_value x p e.
Proof.
  induction e as [| t e H]; [cbn; ring |]. cbn [negated map]. rewrite !expression_value_cons. fold (negated e). rewrite H.
  unfold term_value; cbn [number parameters powers]. rewrite Q2R_opp. ring.
Qed.

Lemma constant_value x p q e : constant e = true -> expression_value x p e = expression_value x q e.
Proof.
  induction e as [| t e H]; [reflexivity |]. cbn [constant forallb]. intro c. apply andb_prop in c as [ct ce].
  rewrite !expression_value_cons, (H ce). unfold term_value. destruct (parameters t); [reflexivity | discriminate].
Qed.

Variable x : nat -> R.
Hypothesis nonzero : forall k, x k <> 0.
Variable now : list R.
Hypothesis admissible : in_ranges now ranges.
Hypothesis lifted : Forall (fun lift => x (fst lift) = expression_value x (listed now) (snd lift)) lifts.

Lemma difference_value p lift : In lift lifts -> constant (snd lift) = true -> expression_value x p (difference lift) = 0.
Proof.
  intros here fixed. unfold difference. rewrite expression_value_cons, negated_value. unfold term_value; cbn [number parameters powers].
  rewrite power_of_value, first_power by apply nonzero. cbn [Nat.add].
  rewrite (proj1 (Forall_forall _ _) lifted _ here).
  rewrite (constant_value x p (listed now) (snd lift) fixed).
  unfold Q2R; cbn. field.
Qed.

Lemma magnitude_value lift : In lift lifts -> 0 <= expression_value x (listed now) (magnitude lift).
Proof.
  intro here. unfold magnitude. rewrite expression_value_product, expression_value_cons. unfold term_value at 1; cbn [number parameters powers].
  rewrite power_of_value, zeroth_power. cbn [Nat.add].
  rewrite <- (proj1 (Forall_forall _ _) lifted _ here). pose proof (nonzero (fst lift)) as nz.
  replace (Q2R 1) with 1 by (unfold Q2R; cbn; field). cbn [parameters_value fold_right expression_value].
  unfold sign. destruct (Rle_dec 0 (x (fst lift))); nra.
Qed.

(* The cell of a point. *)
Definition root_of (k : nat) : R := match nth_error columns k with Some c => Rpower (Rabs (x k)) (/ IZR (Zpos (weight c))) | None => 1 end.
Fixpoint signs_from (k : nat) (l : list column) : list bool :=
  match l with nil => nil | c :: l => (if Rlt_dec (x k) 0 then true else false) :: signs_from (S k) l end.

Lemma in_own_cell : forall l k, (forall j c, nth_error l j = Some c -> nth_error columns (k + j) = Some c) ->
  in_cell x root_of k (signs_from k l) l.
Proof.
  induction l as [| c l H]; intros k same; cbn; [exact I |]. repeat split.
  - pose proof (nonzero k). destruct (Rlt_dec (x k) 0); lra.
  - unfold root_of. pose proof (same O c eq_refl) as at_k. rewrite Nat.add_0_r in at_k. now rewrite at_k.
  - apply H. intros j d at_j. replace (S k + j)%nat with (k + S j)%nat by lia. now apply same.
Qed.

Lemma roots_positive k : 0 < root_of k.
Proof. unfold root_of. destruct (nth_error columns k); [apply exp_pos | lra]. Qed.

Lemma own_signs : forall l k, (forall j c, nth_error l j = Some c -> positive_only c = true -> 0 < x (k + j)%nat) ->
  In (signs_from k l) (all_signs l).
Proof.
  induction l as [| c l H]; intros k pos; cbn [signs_from all_signs]; [now left |].
  assert (rest : In (signs_from (S k) l) (all_signs l)).
  { apply H. intros j d at_j p. replace (S k + j)%nat with (k + S j)%nat by lia. exact (pos (S j) d at_j p). }
  apply in_or_app. destruct (Rlt_dec (x k) 0) as [neg |].
  - right. destruct (positive_only c) eqn:p; [| now apply in_map].
    pose proof (pos O c eq_refl p) as up. rewrite Nat.add_0_r in up. lra.
  - left. now apply in_map.
Qed.

Lemma prepared_conditions form (u : nat -> R) (holds : R -> Prop) l :
  (forall e p, In e l -> form e = Some p -> holds (at_point u p)) ->
  forall a, In a (prepared_by form l) -> exists p, a = prepare p /\ holds (at_point u p).
Proof.
  intros all a. induction l as [| e l H]; [easy |]. cbn [prepared_by].
  assert (rest : forall e p, In e l -> form e = Some p -> holds (at_point u p)) by (intros f p later; apply all; now right).
  destruct (form e) as [p |] eqn:some; [| now apply H].
  intros [<- | later]; [| now apply H]. exists p. split; [reflexivity |]. apply (all e); [now left | exact some].
Qed.

Lemma not_negative_magnitude lift : not_negative ranges (snd lift) = true -> not_negative ranges (magnitude lift) = true.
Proof.
  unfold magnitude, product_of. cbn [flat_map]. rewrite app_nil_r. unfold not_negative. intro fine.
  apply forallb_forall. intros t here. apply in_map_iff in here as [t' [<- here]].
  cbn [product_of_terms parameters app]. exact (proj1 (forallb_forall _ _) fine t' here).
Qed.

Lemma first_in {A : Type} good (l : list A) : first good l = true -> exists a, In a l /\ good a = true.
Proof.
  induction l as [| a l H]; cbn; [discriminate |]. destruct (good a) eqn:ok.
  - intros _. exists a. split; [now left | exact ok].
  - intro more. destruct (H more) as [b [here yes]]. exists b. split; [now right | exact yes].
Qed.

Theorem covers_sound e : covers e = true ->
  (forall k c, nth_error columns k = Some c -> positive_only c = true -> 0 < x k) ->
  Forall (fun q => forall u, (forall k, 0 < u k) -> within u q -> 0 <= at_point u (target q)) questions ->
  forall l, in_ranges l ranges -> 0 <= expression_value x (listed l) e.
Proof.
  intros all pos hold l inside. apply andb_prop in all as [aff all]. apply andb_prop in aff as [aff fine].
  apply (ends_decide x e aff ranges nil); [| exact inside]. intros v here. cbn [app].
  pose proof (proj1 (forallb_forall _ _) all _ (own_signs columns 0 pos)) as mine.
  pose proof (in_own_cell columns 0 (fun j c H => H)) as cell. set (signs := signs_from 0 columns) in *.
  assert (zeros : forall h, In h (prepared_by (cell_polynomial signs columns nil)
      (map difference (filter (fun lift => constant (snd lift)) lifts))) -> exists p, h = prepare p /\ at_point root_of p = 0).
  { apply (prepared_conditions _ root_of (fun r => r = 0)). intros d p is_d some.
    rewrite (value_cell_polynomial _ _ _ _ _ cell _ _ some).
    apply in_map_iff in is_d as [lift [<- il]]. apply filter_In in il as [il fixed]. now apply difference_value. }
  assert (ups : forall g, In g (prepared_by (at_most signs columns ranges) (map magnitude lifts)) ->
      exists p, g = prepare p /\ 0 <= at_point root_of p).
  { apply (prepared_conditions _ root_of (fun r => 0 <= r)). intros d p is_d some.
    apply in_map_iff in is_d as [lift [<- il]]. eapply Rle_trans; [apply (magnitude_value lift il) |].
    apply (value_at_most x root_of signs columns ranges now cell roots_positive admissible _ _) with (2 := some).
    apply not_negative_magnitude. exact (proj1 (forallb_forall _ _) fine lift il). }
  unfold covered in mine. cbv zeta in mine.
  match type of mine with (if ?a then _ else _) = _ => destruct a eqn:impossible end.
  { exfalso. apply first_in in impossible as [h [ih one]]. destruct (zeros h ih) as [p [-> z]].
    destruct (value_prepared root_of p) as [val _]. rewrite z in val. apply orb_prop in one as [one | one];
      apply (positive_terms_sound root_of _ roots_positive) in one; rewrite ?value_scale in one; lra. }
  match type of mine with (if ?a then _ else _) = _ => destruct a eqn:impossible' end.
  { exfalso. apply first_in in impossible' as [g [ig one]]. destruct (ups g ig) as [p [-> z]].
    destruct (value_prepared root_of p) as [val d].
    apply (positive_terms_sound root_of _ roots_positive) in one. rewrite value_scale in one. nra. }
  pose proof (proj1 (forallb_forall _ _) mine v here) as at_v. cbn beta in at_v.
  destruct (cell_polynomial signs columns v e) as [p |] eqn:some; [| discriminate].
  assert (same : expression_value x (listed (map Q2R v)) e = at_point root_of p).
  { rewrite (value_cell_polynomial _ _ _ _ _ cell _ _ some). apply expression_value_same. intro i.
    unfold listed, at_vertex. replace 0 with (Q2R 0) by (unfold Q2R; cbn; field). apply map_nth. }
  rewrite same. apply first_in in at_v as [[q [a [b c]]] [iq match_]]. unfold table in iq.
  apply in_map_iff in iq as [q' [eq iq]]. injection eq as -> <- <- <-. unfold matching in match_.
  destruct (equal (prepare p) (prepare (target q))) eqn:eq; [| discriminate].
  rewrite (equal_sound root_of _ _ eq). apply andb_prop in match_ as [mh mg].
  apply (proj1 (Forall_forall _ _) hold q iq root_of roots_positive). split; apply Forall_forall.
  - intros g ig. pose proof (proj1 (forallb_forall _ _) mg g ig) as ok. cbn beta in ok.
    destruct (is_variable g) eqn:is_one.
    + unfold is_variable in is_one. destruct (variable_of g) as [j |] eqn:var; [| discriminate].
      destruct (value_of_variable _ _ var) as [k [pk vk]]. rewrite vk. pose proof (roots_positive j). nra.
    + apply first_in in ok as [known [ik same_g]]. destruct (ups known ik) as [r [-> ge]].
      now rewrite <- (equal_sound root_of _ _ same_g).
  - intros h ih. pose proof (proj1 (forallb_forall _ _) mh (prepare h) (in_map prepare _ _ ih)) as ok. cbn beta in ok.
    apply first_in in ok as [known [ik same_h]]. destruct (zeros known ik) as [r [-> z]].
    now rewrite <- (equal_sound root_of _ _ same_h).
Qed.
End Coverage.

(* ---------------------------------------------------------------- the two inequalities of a loop *)

Definition nowhere_zero (x : nat -> R) := forall k, x k <> 0.
(* Columns after those of the states: x_k = P(x) with parameters p, and x_k > 0 where it says so. *)
Definition with_lifts (x : nat -> R) (p : list R) (columns : list column) (lifts : list (nat * expression)) : Prop :=
  (forall k c, nth_error columns k = Some c -> positive_only c = true -> 0 < x k) /\
  Forall (fun lift => x (fst lift) = expression_value x (listed p) (snd lift)) lifts.
Definition all_hold (questions : list question) : Prop :=
  Forall (fun q => forall u, (forall k, 0 < u k) -> within u q -> 0 <= at_point u (target q)) questions.
Definition rest (v margin : expression) : expression := v ++ negated margin.
Definition fall (v : expression) (field : list expression) (margin : expression) : expression :=
  negated (rate_from 0 v field ++ margin).

Theorem bound_sound columns questions v margin : all_hold questions ->
  covers columns nil nil questions (rest v margin) = true -> forall x, nowhere_zero x -> with_lifts x nil columns nil ->
  expression_value x (listed nil) margin <= expression_value x (listed nil) v.
Proof.
  intros hold all x nz [pos lifted].
  pose proof (covers_sound columns nil nil questions x nz nil I lifted _ all pos hold nil I) as ge.
  unfold rest in ge. rewrite expression_value_app, negated_value in ge. lra.
Qed.

Theorem fall_sound columns lifts ranges questions v field margin : all_hold questions ->
  covers columns lifts ranges questions (fall v field margin) = true ->
  forall x, nowhere_zero x -> forall p, in_ranges p ranges -> with_lifts x p columns lifts ->
  forall d, (forall i, derivable_pt_lim (fun t => expression_value (update x i t) (listed p) v) (x i) (d i)) ->
  along_field d x (listed p) 0 field <= - expression_value x (listed p) margin.
Proof.
  intros hold all x nz p inside [pos lifted] d der.
  pose proof (covers_sound columns lifts ranges questions x nz p inside lifted _ all pos hold p inside) as ge.
  unfold fall in ge. rewrite negated_value, expression_value_app in ge.
  rewrite (rate_value x (listed p) v d nz der field 0) in ge. lra.
Qed.

Definition odd_power (a : Q) : Q * bool := (a, true).
Definition even_power (a : Q) : Q * bool := (a, false).
Definition sign_only : Q * bool := (0%Q, true).
Definition absent : Q * bool := (0%Q, false).
